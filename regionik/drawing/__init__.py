"""What is drawn, before anything draws it; figures, and the parts of pages."""
