"""What trainings of several methods are made of: weighed losses, stages and their products."""
