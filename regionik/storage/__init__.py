"""Files written atomically, and plans as JSON documents."""
