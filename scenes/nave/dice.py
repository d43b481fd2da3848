"""Random numbers that are the same in every version of Python."""


class Dice:
    """A linear congruential generator; `throw` uses its better, upper bits."""

    def __init__(self, seed):
        self.state = seed

    def throw(self, sides):
        """A number from 0 to sides - 1."""
        self.state = (self.state * 1103515245 + 12345) % 2**31
        return (self.state >> 16) % sides
