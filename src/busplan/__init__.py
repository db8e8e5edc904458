"""busplan: does this motion network fit its period, and how many axes can it carry?"""

__version__ = "0.1.0"
