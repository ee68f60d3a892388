"""Plant, driver, brake, observer and controller as one system; stops, ideal distances, limit cycles."""
