"""The second stage of motion matching: a conditional GAN that smooths what was found."""
