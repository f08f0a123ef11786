~Version ---------------------------------------------------
VERS.   2.0 : CWLS log ASCII Standard -VERSION 2.0
WRAP.    NO : One line per depth step
DLM . SPACE : Column Data Section Delimiter
~Well ------------------------------------------------------
STRT.m    0.0 : START DEPTH
STOP.m  715.0 : STOP DEPTH
STEP.m    0.0 : STEP
NULL. -999.25 : NULL VALUE
COMP.         : COMPANY
WELL.         : WELL
FLD .         : FIELD
LOC .         : LOCATION
PROV.         : PROVINCE
CNTY.         : COUNTY
STAT.         : STATE
CTRY.         : COUNTRY
SRVC.         : SERVICE COMPANY
DATE.         : DATE
UWI .         : UNIQUE WELL ID
API .         : API NUMBER
~Curve Information -----------------------------------------
DEPT                    .m     : md_m
INCL                    .deg   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : t   : inclination_deg
AZIM                    .deg   : azimuth_deg
GTF                     .deg   : toolface_deg
MTF                     .deg   : magnetic_toolface_deg
GTOT                    .m/s2  : g_total_m_s2
BTOT                    .nT    : b_total_nT
DIP                     .deg   : dip_deg
UINC                    .deg   : u_inclination_deg
UAZI                    .deg   : u_azimuth_deg
UGTF                    .deg   : u_toolface_deg
u_inclination_common_deg.      : u_inclination_common_deg
u_azimuth_common_deg    .      : u_azimuth_common_deg
correlation_common      .      : correlation_common
u_inclination_random_deg.      : u_inclination_random_deg
u_azimuth_random_deg    .      : u_azimuth_random_deg
correlation_random      .      : correlation_random
~Params ----------------------------------------------------
AZIREF. magnetic : NORTH AZIMUTHS ARE FROM
~Other -----------------------------------------------------
~ASCII
0 0.5318869357 73.7591058292 341.7400671313 55.4991729605 9.810553402653875 49938.04382181819 70.0097920438 0.0279120837 3.0340763258 3.0486180183 0.018782004063334752 2.048154457055321 0.010363198017964745 0.020647535916746746 2.238455376111225 0.004458281308908123
30 0.5028039846 76.3369686724 156.7303732607 233.0673419332 9.808137916097493 50013.06707491875 70.0050070708 0.0279987585 3.2066604691 3.217063597 0.018842351120954105 2.165066286437081 0.009838852248476715 0.020709811207707558 2.3654089159524125 0.007609075585894218
60 0.479869119 73.1633651878 109.4357199388 182.5990851266 9.810417551421464 50017.79445193849 69.9749044546 0.0285325919 3.2951926091 3.3060853392 0.019196999963152907 2.2272020921929054 -0.0059661524783244 0.021108860499375794 2.4285520730662458 -0.01768546447575