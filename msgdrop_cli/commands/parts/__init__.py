"""What commands share, a file for each thing it does. `console` is the only module that prints."""
