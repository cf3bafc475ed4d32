"""The shape of a mouth: lips, crops, and what is left without the motion of the head."""
