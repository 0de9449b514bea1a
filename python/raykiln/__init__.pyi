import os
from typing import Any, Literal, Optional, Sequence, TypedDict, Union, final

import numpy as np
import numpy.typing as npt

__version__: str

_Source = Union[str, os.PathLike[str], bytes]
_Option = Union[str, int, float, bool, Sequence[str]]

class Error(ValueError):
    """A file cannot be read, written or baked, or an option is wrong."""

@final
class Baked:
    """The result of a bake."""

    @property
    def report(self) -> dict[str, Any]:
        """The report, as `raykiln bake --json` prints it."""
    @property
    def verdict(self) -> Literal["faster", "not faster", "left alone", "failed"]:
        """What came of it. After `failed` there is no output."""
    @property
    def glb(self) -> Optional[bytes]:
        """The output, if it was not written to a file."""

class _Groups(TypedDict):
    """The mesh groups of a file, and their instances."""

    names: list[str]
    mesh: npt.NDArray[np.uint32]
    """Index of each group's mesh in the file."""
    geometries: npt.NDArray[np.uint32]
    """Number of geometries of each group."""
    triangles: npt.NDArray[np.uint64]
    """Number of triangles of each group."""
    instance_group: npt.NDArray[np.uint32]
    """Group of each instance."""
    instance_node: npt.NDArray[np.uint32]
    """Node of each instance."""
    instance_transform: npt.NDArray[np.float64]
    """World from group, one 3x4 matrix per instance."""
    instance_bounds: npt.NDArray[np.float64]
    """World box of each instance: least and largest corner."""

class _Provenance(TypedDict):
    """One row per triangle that `after` places; -1 where the triangle of `before` is not known."""

    group: npt.NDArray[np.int64]
    instance: npt.NDArray[np.int64]
    source_node: npt.NDArray[np.int64]
    source_copy: npt.NDArray[np.int64]
    source_mesh: npt.NDArray[np.int64]
    source_primitive: npt.NDArray[np.int64]
    source_triangle: npt.NDArray[np.int64]
    """Triangle of the primitive, as the file counts it."""

def bake(
    source: _Source,
    *,
    output: Optional[Union[str, os.PathLike[str]]] = None,
    name: Optional[str] = None,
    **options: _Option,
) -> Baked:
    """Bakes a file, or the bytes of one that refers to no other.

    Without `output`, the result is `Baked.glb`; the input must then refer to no other file. `name` says what bytes are, such as
    `chair.obj`; without it they are glTF or GLB. `options` are those of `raykiln bake`, with `_` for `-`.
    """

def inspect(source: _Source, *, name: Optional[str] = None, **options: _Option) -> dict[str, Any]:
    """Returns what a scene is made of, what it costs to trace and which vendor rules it breaks."""

def verify(
    before: Union[str, os.PathLike[str]], after: Union[str, os.PathLike[str]], **options: _Option
) -> dict[str, Any]:
    """Traces the same rays through two files and compares them. `options` are the verification options of `raykiln bake`."""

def groups(source: Union[str, os.PathLike[str]]) -> _Groups:
    """Returns the mesh groups of a file: each is one BLAS."""

def provenance(before: Union[str, os.PathLike[str]], after: Union[str, os.PathLike[str]]) -> _Provenance:
    """Returns where each triangle of a baked file comes from, by what the file records."""
