"""Compiled numerics on bare arrays.

A kernel sees scalars and C-contiguous, writable float64 arrays, and returns arrays and codes;
names, units and checks are the business of the layers above. Sizes that a kernel should know
when it is compiled are passed as tuples of that length (`rows` for the degree, `axes` for the
axes): their loops are unrolled, one source serves every degree, and only the degree in use is
compiled.
"""
