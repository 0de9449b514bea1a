#version 460
#extension GL_GOOGLE_include_directive : require
#include "interface.glsl"
#include "timing.glsl"

layout(location = 0) rayPayloadInEXT Timed payload;

void main() {
    payload.t = gl_HitTEXT;
}
