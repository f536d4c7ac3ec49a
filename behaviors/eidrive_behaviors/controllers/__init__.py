"""Controller models: implementations of controllers for scripted actors."""
