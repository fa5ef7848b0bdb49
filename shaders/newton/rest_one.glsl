float rest_$KIND(uint record) { return uintBitsToFloat(mesh[record + $ARITY]); }
