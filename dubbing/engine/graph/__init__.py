"""Which stages there are: what each depends on, and whether its result holds."""
