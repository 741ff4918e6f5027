"""The smallest changes that make an impossible target or path possible, each checked."""
