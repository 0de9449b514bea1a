#version 460
#extension GL_GOOGLE_include_directive : require
#include "interface.glsl"

layout(location = 0) rayPayloadInEXT Hit payload;

void main() {
    payload.t = -1.0;
}
