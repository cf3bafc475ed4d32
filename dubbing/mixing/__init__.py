"""The sound of a scene: new voices at their times, over the music and effects or the film's own."""
