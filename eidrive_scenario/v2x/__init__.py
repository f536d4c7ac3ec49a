"""What stations say to each other, and the radio between them."""
