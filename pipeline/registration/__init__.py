"""Small rigid corrections that lay one mapped surface on another."""
