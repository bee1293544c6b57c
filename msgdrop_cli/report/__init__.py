"""Tables and figures for people, made from what `analysis` says; computes no statistics itself."""
