"""How the mouth of a line differs from what its speech asks for, and where that is kept."""
