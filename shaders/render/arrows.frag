layout(location = 0) out vec4 result;
void main() { result = vec4(0.02, 0.025, 0.04, 0.9); }
