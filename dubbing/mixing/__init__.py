"""The audio of a scene: new voices over the music and effects, or over the film's own audio."""
