"""What people ask for over bus and page: admitted, authorised, queued and carried out."""
