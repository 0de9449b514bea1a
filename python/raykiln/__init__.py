"""Raykiln bakes scenes for hardware ray tracing: it decides which triangles share a bottom-level acceleration structure."""

from ._raykiln import Baked, Error, __version__, bake, groups, inspect, provenance, verify

__all__ = ["Baked", "Error", "__version__", "bake", "groups", "inspect", "provenance", "verify"]
