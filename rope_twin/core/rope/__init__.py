"""What an element is: its section, its law of tension, its stiffness."""
