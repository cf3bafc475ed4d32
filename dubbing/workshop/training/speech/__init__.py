"""Teaching the speech features, and measuring what they know: needs more than using them."""
