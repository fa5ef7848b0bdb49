#include <cstdio>
int main() { std::puts("tetpbd"); }
