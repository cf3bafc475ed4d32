"""What lips do while something is said: learned from the lips of many people, whoever speaks."""
