"""The Python interface: one module for each function and its answer; `import busplan` has them all."""
