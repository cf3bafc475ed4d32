"""Names of files of a prepared clip that others than its readers show; loads nothing."""

CONTACT_SHEET, SUMMARY = "contact_sheet.png", "prepared.json"
