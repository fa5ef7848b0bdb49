// A record: vertices, values at rest, and compliances if the kind has them of a material.
#foreach #include "newton/rest_$REST.glsl"
