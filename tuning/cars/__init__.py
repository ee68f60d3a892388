"""Cars and vehicles as configurations have them."""
