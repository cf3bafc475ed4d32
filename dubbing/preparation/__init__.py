"""Preparation of a clip: head poses, head matte, restored background."""
