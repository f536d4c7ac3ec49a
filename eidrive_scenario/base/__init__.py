"""Arrays, geometry, random numbers and the types that several packages exchange; imports only the errors."""
