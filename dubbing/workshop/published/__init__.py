"""Files of the published code, read into ours."""
