"""What a calibration certificate says, and the forms it is issued in: record, PDF, digital certificate (DCC)."""
