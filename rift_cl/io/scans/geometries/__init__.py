"""Files that say where source and detector stand: of scanners, of other packages, and our own."""
