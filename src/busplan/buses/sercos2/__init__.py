"""SERCOS I and II: an optical ring whose drives answer one after the other between two telegrams of the master."""
