"""Parts of a motion: with the tool on its path, with the tool lifted, and the arm avoiding obstacles."""
