"""Training data: frames of a person, rays drawn from them, references cut out of them."""
