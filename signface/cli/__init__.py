"""The command `signface`: a module a command, which parses, calls a function and prints."""
