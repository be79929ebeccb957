"""Shadow volumes on OpenGL: one counting engine, one stem per method (Milet et al.; Stich, Waechter, Keller 2007)."""
