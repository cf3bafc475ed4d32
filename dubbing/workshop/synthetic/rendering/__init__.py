"""Pictures of the synthetic head: camera, light, room, torso."""
