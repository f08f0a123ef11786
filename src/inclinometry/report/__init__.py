"""Reports a person reads: one self-contained HTML file each, figures, and the rows of tables for any face.

calibration, verification, survey, gyro, allan
    `calibration_report`, `verification_report`, `survey_report`, `gyro_report`, `scale_report`, `allan_report`:
    offline HTML, light and dark; same input, same bytes.
certificate, certificate_record
    `certificate_pdf`, `certificate_record`: PDF/A of a calibration certificate, and the record it is made from.
comparison
    `comparison_figure`: methods side by side.
tables, digits
    Rows of (label, value, uncertainty, unit) and how many digits of them mean something.
words
    What a calibration says, in sentences.
figure, page
    One style for all drawings (matplotlib, loaded when something is drawn) and all pages (jinja2).
"""
