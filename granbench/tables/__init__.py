"""Reading of tables from users: text files and workbooks."""
