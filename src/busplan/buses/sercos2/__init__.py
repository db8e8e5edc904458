"""SERCOS I and II: an optical ring whose drives answer in turn between two telegrams of the master."""
