"""Plans, answers and reach fields as files for other programs."""
