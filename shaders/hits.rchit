#version 460
#extension GL_GOOGLE_include_directive : require
#include "interface.glsl"

layout(location = 0) rayPayloadInEXT Hit payload;

void main() {
    payload.t = gl_HitTEXT;
    payload.entry = gl_InstanceCustomIndexEXT;
    payload.geometry = gl_GeometryIndexEXT;
    payload.primitive = gl_PrimitiveID;
    payload.front = gl_HitKindEXT == gl_HitKindFrontFacingTriangleEXT ? 1u : 0u;
}
