"""The Python interface: each function a module, with its answer; `import busplan` gives them all by name."""
