void start_$KIND(uint c, inout uint bad) {}
