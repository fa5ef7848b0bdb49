// The points below y = 0.
Surface half_space_surface(Solid s, vec3 p) { return Surface(vec3(real(0), real(1), real(0)), p.y); }
