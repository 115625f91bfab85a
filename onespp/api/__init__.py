"""The functions of `import onespp`, which the command line calls too."""
