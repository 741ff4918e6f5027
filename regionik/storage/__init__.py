"""Files written whole or not at all, and plans as text."""
