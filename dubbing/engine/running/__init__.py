"""How stages are brought up to date: here, in processes, on other machines."""
