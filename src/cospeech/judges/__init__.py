"""What judges motion and is trained for it: the motion auto-encoder and the phase classifier."""
