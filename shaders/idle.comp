// Does nothing: dispatched so that a context has used another kernel than the one to come (step_thread.cpp).
layout(local_size_x = 1) in;

void main() {}
