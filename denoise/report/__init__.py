"""What people look at: tables, pictures, a page."""
