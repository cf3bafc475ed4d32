"""What is behind the head: wall, torso and neck."""
