"""Tables of other programs made recordings: whatever file it is, each thing is read right, or refused in one line.

From the file to the recording:

    file_kind                               which kind of file it is, and the tables that it may be
    raw_table                               rows of cells before anything is understood
    text_table                              encodings, separators, quotation marks
    typed_tables                            Excel workbooks, Parquet
    measurement_files                       MATLAB, HDF5, TDMS, MDF4
    matlab_reader, mdf4_reader              MATLAB before 7.3 and MDF4, each in a process of its own
    reader_process                          that process: it may break down or come to no end, and nothing else does
    line_protocol                           InfluxDB's line protocol
    export_units                            units, by all the names people give them
    column_mapping                          `OURS=THEIRS:UNIT`, `--status`, and how else an export is read
    header_search                           the line that names the columns, and the units about it
    column_names                            what columns are called, by language and trade
    control_loop                            whether it is a loop's, OP, PV and SP, and tells of no stem
    number_notation                         decimal signs and thousands separators
    time_stamps                             dates and times as seconds
    time_order                              newest first, disorder, repeated rows and hours
    own_format                              whether it is a recording of our own already
    plausibility                            what is odd about a recording, before anything is fitted to it
    export_preview                          what a file holds, and the words that would read it
    import_questions, mapping_file          what they leave open, asked; the answers, kept in a file for next time
"""
